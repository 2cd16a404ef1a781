"""Images of materials: decoding, KTX2, packing of channels, smaller copies."""
