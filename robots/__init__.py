"""What a robot is and how it moves in simulation."""
