"""The mechanics of any scene: markers, constraints, free coordinates, equations of motion."""
