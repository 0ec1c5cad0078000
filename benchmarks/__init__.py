"""How fast it is: timings on meshes of 200 to 100 000 degrees of freedom, beside OpenSeesPy where that is installed."""
