"""Other programs' formats: captures and files of splats."""
