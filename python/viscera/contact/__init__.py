"""What touches an organ: rigid tools, forceps, the ground, other organs; with friction."""
