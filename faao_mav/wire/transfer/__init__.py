"""The mission protocol: state machines without sockets or sleeping."""
