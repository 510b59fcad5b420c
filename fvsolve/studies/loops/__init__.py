"""Studies of control loops: return ratio, margins, stability and poles, with exact delays and with samples."""
