"""The rate of a link as a function of the place of the UAV."""
