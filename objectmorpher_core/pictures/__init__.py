"""Pictures in and out of files, at their own bit depth and with their own profile."""
