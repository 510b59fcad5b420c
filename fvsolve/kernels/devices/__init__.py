"""Parts with states, events or an opening of their own: one file a law, and one entry for each in `laws`."""
