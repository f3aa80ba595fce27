//! The parts of a client whose calls wait for their end. A client that blocks and one whose functions
//! are futures have the same.

/// The example of an accessor. `client` is the code that makes a client.
macro_rules! accessor {
    ($client:literal, $example:literal) => {
        concat!(
            "\n```\n# include!(concat!(env!(\"CARGO_MANIFEST_DIR\"), \"/tests/doc/pump.rs\"));\n",
            $client,
            "\n",
            $example,
            "\n# Ok(())\n# }\n```"
        )
    };
}

/// The functions that return the parts. `client` is the code of an example that makes one.
macro_rules! accessors {
    ($client:literal) => {
        /// Timeouts and other settings of requests: see [`Client::settings`].
        #[doc = accessor!($client, "client.settings().response_timeout.set_timeout(500)?;")]
        pub fn settings(&mut self) -> &mut Settings {
            self.client.settings()
        }

        /// The policy for retries.
        #[doc = accessor!($client, "client.policy().retries = 2;")]
        pub fn policy(&mut self) -> &mut Policy {
            self.client.policy()
        }

        /// The port. Call [`Self::reconnect`] after a new socket was put in its place.
        #[doc = accessor!($client, "let port = client.port();")]
        pub fn port(&mut self) -> &mut L::Port {
            self.client.port()
        }

        /// The buffers, with the counters.
        #[doc = accessor!($client, "let buffers = client.storage();")]
        pub fn storage(&mut self) -> &mut L::Storage {
            self.client.storage()
        }

        /// The serial line or TCP stream.
        #[doc = accessor!($client, "assert!(client.line().set_in_flight(1));")]
        pub fn line(&mut self) -> &mut L {
            &mut self.client.line
        }

        /// Calls in a row that timed out: see [`Client::unanswered`].
        #[doc = accessor!($client, "assert_eq!(client.unanswered(), 0);")]
        pub fn unanswered(&self) -> u8 {
            self.client.unanswered()
        }
    };
}

pub(super) use {accessor, accessors};
