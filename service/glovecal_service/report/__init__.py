"""The comparison as a page: pictures, each with a sentence that says what it shows in this data."""
