"""The documents' own figures and plots of agreement, as PNG files: `pip install 'steplink[figures]'`."""
