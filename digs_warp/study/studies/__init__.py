"""The studies: each file holds the cases of one question, and what its report draws."""
