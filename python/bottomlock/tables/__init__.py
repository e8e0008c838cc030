"""Tables that pass between the rooms and go to disk: columns, types, meanings; results read back and checked."""
