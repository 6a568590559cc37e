//! The application every board shares: control plane, link plane, scene store, safety, simulated mechanism
