"""`python -m rid_daq` is `rid-daq`."""

from rid_daq.app import main

if __name__ == "__main__":
    main()
