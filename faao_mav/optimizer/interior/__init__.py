"""The interior-point method: a flight through fields of rates, within its constraints."""
