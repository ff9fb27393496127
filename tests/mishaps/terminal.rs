//! Terminals: what they send, what they cannot do, and job control.
