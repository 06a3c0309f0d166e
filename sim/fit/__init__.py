"""The figures of a real depth camera, measured on its recordings and fitted by simulating the same scenes."""
