//! One client for every rig: in-process simulation, emulated board, serial port
