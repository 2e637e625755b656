"""Bodies: plans of masses, springs and faces that are varied, kept valid, and built as robots."""
