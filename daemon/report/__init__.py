"""Results for people and programs: tables, pictures, JSON, HTML and PDF."""
