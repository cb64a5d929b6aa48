"""The studies: every figure and table of the two papers, measured anew and written as one HTML report each."""
