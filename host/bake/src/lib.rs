//! CAD model to scene image: exact signed distance, bricks, pointshell
