"""What a robot is made of: its fields and elements, and the verbs that give it more."""
