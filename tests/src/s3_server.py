"""An S3 server that checks signatures (moto's, from PyPI), with the files of a folder in a bucket.

Arguments: the folder. Prints a line of JSON: where it listens, and the keys of a user who may read the bucket `scans`. The
folder's files are objects of `scans` and of `other`, which that user may read, too. Ends when its standard input does.
"""

import json
import logging
import os
import pathlib
import sys

# Actions below this count are not checked: those that make the user, and one more for each that nobody has yet.
os.environ["INITIAL_NO_AUTH_ACTION_COUNT"] = "3"
logging.getLogger("werkzeug").setLevel(logging.ERROR)

from urllib.parse import parse_qsl, quote  # noqa: E402

import boto3  # noqa: E402
from moto.iam.access_control import IAMRequestBase  # noqa: E402
from moto.server import ThreadedMotoServer  # noqa: E402

as_told = IAMRequestBase._create_aws_request


def as_sent(self):
    """The request that is signed: moto has its query without the escapes that it was sent and signed with."""
    request = as_told(self)
    path, mark, query = request.url.partition("?")
    pairs = [f"{quote(name, safe='-_.~')}={quote(value, safe='-_.~')}" for name, value in parse_qsl(query, True)]
    request.url = path + mark + "&".join(pairs)
    return request


IAMRequestBase._create_aws_request = as_sent

REGION = "eu-central-1"
MAY = {
    "Version": "2012-10-17",
    "Statement": [{"Effect": "Allow", "Action": "s3:*", "Resource": "*"}],
}

server = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
server.start()
host, port = server.get_host_and_port()
address = f"http://{host}:{port}"


def client(service, key, secret):
    return boto3.client(
        service, endpoint_url=address, region_name=REGION, aws_access_key_id=key, aws_secret_access_key=secret
    )


iam = client("iam", "nobody", "nothing")
iam.create_user(UserName="reader")
iam.put_user_policy(UserName="reader", PolicyName="reads", PolicyDocument=json.dumps(MAY))
made = iam.create_access_key(UserName="reader")["AccessKey"]
key, secret = made["AccessKeyId"], made["SecretAccessKey"]
s3 = client("s3", key, secret)
folder = pathlib.Path(sys.argv[1])
for bucket in ["scans", "other"]:
    s3.create_bucket(Bucket=bucket, CreateBucketConfiguration={"LocationConstraint": REGION})
    for path in sorted(folder.rglob("*")):
        if path.is_file():
            s3.put_object(Bucket=bucket, Key=path.relative_to(folder).as_posix(), Body=path.read_bytes())
print(json.dumps({"address": address, "key": key, "secret": secret, "region": REGION}), flush=True)
sys.stdin.read()
server.stop()
