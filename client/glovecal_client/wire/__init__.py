"""The binary messages, version 1; README.md beside this file describes them byte by byte."""
