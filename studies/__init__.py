"""What is asked: one question a module, the command line, runs, timings, tables, pictures, the page."""
