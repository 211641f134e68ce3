"""Each tool's part of the inspector. They only draw; changes are calls of the editor's methods."""
