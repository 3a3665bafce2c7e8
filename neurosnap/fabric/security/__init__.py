"""Who may connect and say what: roles, certificates, endpoints."""
