"""Physics on an accelerator, or on the processor as its stand-in: MuJoCo Warp. Needs the extra `gpu`."""
