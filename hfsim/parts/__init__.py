"""What a deck can name, one file for each: elements, bodies, joints, forces, channels."""
