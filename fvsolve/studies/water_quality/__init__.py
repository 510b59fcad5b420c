"""Water age and source tracing in networks without waves: moving segments, driven by the flows of a run."""
