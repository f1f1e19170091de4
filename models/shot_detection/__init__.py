"""Where one shot ends and the next begins: cuts, jump cuts, dissolves and fades."""
