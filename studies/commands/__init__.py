"""What the commands do. A module is imported when one of its commands is called."""
