"""A camera before the colour glove as a live source: pictures in, poses out, published like any glove's."""
