"""What comes from gloves over zenoh, before anybody works with it: frames are let in, refused and ordered."""
