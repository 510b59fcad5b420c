"""The same said in another way has the same answer; a part alone, whatever its neighbours, keeps what it is given."""
