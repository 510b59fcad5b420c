"""Reports of finished runs: an offline HTML page, a workbook of tables, pictures and pressure cycles."""
