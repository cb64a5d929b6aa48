"""The reduced model: how it is asked for, made, kept, checked, and what it answers to touches, hands and probes."""
