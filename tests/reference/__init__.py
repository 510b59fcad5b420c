"""Reference solutions for the tests: closed forms, exact constructions and independent numerical solutions."""
