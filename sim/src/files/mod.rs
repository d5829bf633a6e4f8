//! Reading and writing files: text with located errors, output that is complete or absent.
