"""Files of meshes, surfaces and numbers: read as they stand, and written whole or not at all."""
