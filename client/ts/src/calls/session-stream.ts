import type { ClientDuplexStream } from "@grpc/grpc-js";

import { errorOf } from "../errors.js";
import type { Connection } from "../connection/connection.js";
import { SolverService } from "../generated/marble/v1/service.js";
import type {
  SessionReady,
  SessionRequest,
  SessionResponse,
  SessionSetup,
  SessionUpdate,
} from "../generated/marble/v1/session.js";
import { duplex, received } from "./calls.js";
import { lost } from "./status.js";

/** Events of a session's updates. */
export type SessionEvent = Exclude<NonNullable<SessionResponse["event"]>, { $case: "ready" }>;

/** A session on one server. After a loss the next stream has the next epoch. */
export class SessionStream {
  private constructor(
    private readonly call: ClientDuplexStream<SessionRequest, SessionResponse>,
    private readonly responses: AsyncGenerator<SessionResponse>,
    private readonly epoch: number,
    readonly ready: SessionReady,
  ) {}

  /**
   * Opens a session and waits until it is ready.
   *
   * @param withinMs time after which the server counts as lost; default: unlimited.
   */
  static async open(
    connection: Connection,
    setup: SessionSetup,
    signal?: AbortSignal,
    withinMs?: number,
  ): Promise<SessionStream> {
    const call = duplex(connection, SolverService.session, signal);
    const responses = received(call, signal);
    let late = false;
    const timer = withinMs === undefined ? undefined : setTimeout(() => ((late = true), call.cancel()), withinMs);
    try {
      call.write({ request: { $case: "setup", value: setup } });
      const { value } = await responses.next();
      const event = value?.event;
      if (event?.$case === "ready" && (event.value.epoch === setup.epoch || event.value.epoch === 0)) {
        return new SessionStream(call, responses, setup.epoch, event.value);
      }
      call.cancel();
      throw errorOf("internal", "the server did not open the session");
    } catch (error) {
      if (!late) throw error;
      throw lost("the session was not opened in time", error);
    } finally {
      clearTimeout(timer);
    }
  }

  send(update: SessionUpdate): void {
    this.call.write({ request: { $case: "update", value: { ...update, epoch: this.epoch } } });
  }

  /** Ends the session after its last update. */
  end(): void {
    this.call.end();
  }

  /** Cancels all unfinished updates. */
  cancel(): void {
    this.call.cancel();
  }

  /** Events until the server ends the session; throws its error. Skips events of other epochs. */
  async *events(): AsyncGenerator<SessionEvent, void, undefined> {
    for await (const { event } of this.responses) {
      if (event === undefined || event.$case === "ready") continue;
      // Servers without epochs send 0.
      if ("epoch" in event.value && event.value.epoch !== this.ready.epoch) continue;
      yield event;
    }
  }
}
