"""One module is one page: ``add(studio)`` declares its address."""
