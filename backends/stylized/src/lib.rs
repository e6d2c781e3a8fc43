//! The stylized back end.
