"""The operator comes in, picture and recording go out."""
