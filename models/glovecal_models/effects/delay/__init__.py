"""lag and clock_offset: a sensor that answers late, and clocks that disagree."""
