"""From the labels of a scan to a mesh in the axes of the patient, and back onto the grid of the image."""
