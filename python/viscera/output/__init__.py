"""What is written of a solved organ: its fields in files, as series, as a picture; what a file is, by its ending."""
