"""What is handed over: one offline page of a run, and its tables as a workbook. Knows runs; starts none."""
