"""Random worlds: forests of cylinders, and worlds like those of the BARN set."""
