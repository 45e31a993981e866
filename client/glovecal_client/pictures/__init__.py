"""Pictures with time stamps: of a camera, a file or drawn: for a video beside a take, or a camera glove."""
