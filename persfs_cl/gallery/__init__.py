"""What results look like: a preview of each image, and a page, a contact sheet and a table of many."""
