"""Files as laboratories have them: their text, tables, numbers and units, and the records of tests in them."""
