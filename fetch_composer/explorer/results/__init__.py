"""What a run keeps and writes: files, figures and how sure they are."""
