//! What the pictures say of the rig: the rotation axis, the camera of each view.
