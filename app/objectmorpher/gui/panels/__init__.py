"""Each tool's part of the inspector; drawing only, what they change are the editor's methods."""
