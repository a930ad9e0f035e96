"""What an adjustment delivers: frozen records that deformation, terrain, volume, tables and plots start from."""
