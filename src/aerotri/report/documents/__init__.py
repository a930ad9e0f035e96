"""PDF documents made from records with typst: adjustment report, certificates; texts in several languages."""
