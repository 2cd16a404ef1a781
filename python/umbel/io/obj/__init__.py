"""OBJ and its material libraries, read and written."""
