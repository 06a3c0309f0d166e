"""What a person looks at: the report, the interactive view, films along a path."""
