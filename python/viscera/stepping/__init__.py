"""Real time: an organ in steps of time, while hands hold it."""
