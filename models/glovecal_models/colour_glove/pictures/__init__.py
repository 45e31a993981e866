"""From a camera's picture to label images."""
