"""Where energy comes from, stays and goes, and which methods make some. Knows the ledger; judges no accuracy."""
